"""What to say of a Python package that is not there."""
import pathlib
import sys
import sysconfig


def how_to_install(package: str) -> str:
    """The command, after "install it: ". Debian's own Python takes none from pip."""
    managed = sys.prefix == sys.base_prefix and pathlib.Path(sysconfig.get_path('stdlib'), 'EXTERNALLY-MANAGED').exists()
    where = ' in an environment of your own (docs/troubleshooting.md, "Installing")' if managed else ''
    return f'pip install {package}{where}, or scripts/setup_python.sh in the source folder'
