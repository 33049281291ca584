"""Where the files of this package are that are no Python: tables, libraries for FMUs."""
import pathlib
import sys


def folders() -> list[str]:
    """The folders of the package: after `pip install -e` the sources' own, and the one with what CMake has made."""
    return list(sys.modules[__package__].__path__)


def place_of(name: str) -> pathlib.Path:
    """The file or folder of that name; where it should be if there is none."""
    places = [pathlib.Path(folder) / name for folder in folders()]
    return next((place for place in places if place.exists()), places[0])
