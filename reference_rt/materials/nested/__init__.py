"""Materials that are made of other materials."""
