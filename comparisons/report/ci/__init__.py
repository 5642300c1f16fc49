"""What a run found, for the machines that build and test."""
