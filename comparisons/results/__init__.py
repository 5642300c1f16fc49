"""What a comparison found, as data, and how it is stored."""
