"""Stage 6, pictures, the HTML report and tables."""
