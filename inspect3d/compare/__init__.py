"""Stage 5, verdicts, and method against method."""
