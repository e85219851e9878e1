"""The browser pages, `inspect3d pick` and `inspect3d view`: a small server on loopback, and pages without a library."""
