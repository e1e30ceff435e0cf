"""`python -m lidaraccum` is `lidaraccum`."""

from lidaraccum.cli.main import cli

if __name__ == "__main__":
    cli()
