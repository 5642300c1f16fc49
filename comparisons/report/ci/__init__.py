"""Results of a run in the formats of CI services: JUnit XML, GitHub annotations and summaries."""
