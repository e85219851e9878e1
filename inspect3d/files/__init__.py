"""Reading what scanners and CAD systems write: files in, checked arrays out."""
