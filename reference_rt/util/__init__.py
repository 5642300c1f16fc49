"""What knows no rendering: errors and exit codes, files, memory, signals, child processes, the
terminal."""
