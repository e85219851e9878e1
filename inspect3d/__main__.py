"""`python -m inspect3d` is `inspect3d`."""

from inspect3d.cli import main

if __name__ == "__main__":
    main()
