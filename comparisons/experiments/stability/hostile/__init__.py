"""F6: hostile scenes, files and rays end in one line of error."""
