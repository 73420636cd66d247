"""The version of this software, for recordings and reports."""

from importlib.metadata import PackageNotFoundError, version

DISTRIBUTION = "emir_ros"


def software_version() -> str:
    """Return the installed version; from a source tree that is not installed, that word."""
    try:
        return version(DISTRIBUTION)
    except PackageNotFoundError:
        return "not installed"
