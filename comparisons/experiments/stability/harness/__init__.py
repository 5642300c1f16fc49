"""What runs the families of stability: their contract, workers, tables and the page."""
