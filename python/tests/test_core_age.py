"""The package of a build tree says when its compiled module is older than what the program was built from."""
import os
import pathlib
import subprocess
import sys

import abs_hil.core


def import_with(folder, library):
    """Imports a copy of the package, linked from `library`, in a Python of its own."""
    package = pathlib.Path(abs_hil.core.__file__).parent  # links into the source tree: its build's folder holds all of it
    built = pathlib.Path(os.environ['ABS_HIL_BUILD']) / 'share' / 'abs_hil' / 'python' / 'abs_hil'
    assert package == built
    copy = folder / 'abs_hil'
    copy.mkdir()
    for path in built.iterdir():
        if path.name not in ('_build_tree.py', '__pycache__'):
            (copy / path.name).symlink_to(path.resolve())
    text = (built / '_build_tree.py').read_text(encoding='utf-8')
    (copy / '_build_tree.py').write_text(f'{text}CORE_LIBRARIES = [{str(library)!r}]\n', encoding='utf-8')
    return subprocess.run([sys.executable, '-c', 'import abs_hil.core'], capture_output=True, text=True, check=True,
                          env={**os.environ, 'PYTHONPATH': str(folder)}).stderr


def test_a_module_older_than_a_library_says_so_and_how_to_build_it(tmp_path):
    library = tmp_path / 'libabs_hil_control.a'
    library.touch()  # now: after the build
    said = import_with(tmp_path, library)
    assert 'UserWarning: abs_hil: the compiled module' in said
    assert '--target abs_hil_python' in said


def test_a_module_newer_than_its_libraries_says_nothing(tmp_path):
    library = tmp_path / 'libabs_hil_control.a'
    library.touch()
    os.utime(library, (0, 0))
    assert import_with(tmp_path, library) == ''


def test_a_library_that_is_gone_says_nothing(tmp_path):
    assert import_with(tmp_path, tmp_path / 'none.a') == ''


def test_the_build_names_the_libraries_of_its_rooms():
    from abs_hil._build_tree import CORE_LIBRARIES
    names = {pathlib.Path(library).name for library in CORE_LIBRARIES}
    assert {'libabs_hil_control.a', 'libabs_hil_study.a'} <= names
