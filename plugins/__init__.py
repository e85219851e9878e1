"""The measuring methods that come with inspect3d; foreign ones register the same way."""
