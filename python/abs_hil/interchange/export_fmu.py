"""abs_hil export-fmu: the simulated rig, or with --controller a slip controller, as an FMU for co-simulation
(docs/interchange.md)."""
import argparse
import pathlib
import zipfile
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from .. import parsers
from ..core import _core
from ..files import refuse_existing, write_whole
from ..options import as_main
from ..places import place_of

#: the libraries in an FMU: folder and file as this package has them, folder by FMI 2 and 3
FOLDER = place_of('fmu')
IDENTIFIER = 'abs_hil_fmu'
PLATFORMS = (('linux64', '.so', 'linux64', 'x86_64-linux'), ('win64', '.dll', 'win64', 'x86_64-windows'))
TYPES = {'real': ('Real', 'Float64'), 'integer': ('Integer', 'Int32'), 'boolean': ('Boolean', 'Boolean'),
         'string': ('String', 'String')}
#: exponents of the base units of units that tools may convert; others are texts to them
BASE_UNITS: dict[str, dict[str, float]] = {
    'm': {'m': 1}, 's': {'s': 1}, '1/s': {'s': -1}, '1/s^2': {'s': -2}, '1/s^3': {'s': -3}, 'Hz': {'s': -1},
    'm/s': {'m': 1, 's': -1}, 'm/s^2': {'m': 1, 's': -2}, 'm/s^3': {'m': 1, 's': -3}, 'rad/s': {'s': -1, 'rad': 1},
    'rad': {'rad': 1}, 'deg': {'rad': 1, 'factor': 0.017453292519943295}, 'N': {'kg': 1, 'm': 1, 's': -2},
    'N m': {'kg': 1, 'm': 2, 's': -2}, 'N m/s': {'kg': 1, 'm': 2, 's': -3}, 'N m s': {'kg': 1, 'm': 2, 's': -1},
    'kg m^2': {'kg': 1, 'm': 2}, 'kg^2/s^2': {'kg': 2, 's': -2}, 'N m s/rad': {'kg': 1, 'm': 2, 's': -1, 'rad': -1},
    'rad/s^2': {'rad': 1, 's': -2}, 'ms': {'s': 1, 'factor': 1e-3}, 'us': {'s': 1, 'factor': 1e-6}, 's^2': {'s': 2},
    'V': {'kg': 1, 'm': 2, 's': -3, 'A': -1}, 'deg C': {'K': 1, 'offset': 273.15}, 's/kg^2': {'s': 1, 'kg': -2},
    'kg^2 m/s^3': {'kg': 2, 'm': 1, 's': -3}, 'N^2/s': {'kg': 2, 'm': 2, 's': -5}, 'N^2 s': {'kg': 2, 'm': 2, 's': -3},
    '(N m)^2/s': {'kg': 2, 'm': 4, 's': -5}, '1/N': {'kg': -1, 'm': -1, 's': 2}, '1/J': {'kg': -1, 'm': -2, 's': 2},
    's/m': {'s': 1, 'm': -1}}


def _add(parent: Element, tag: str, **attributes: Any) -> Element:
    def text(value: Any) -> str:
        return str(value).lower() if isinstance(value, bool) else f'{value!r}'.removesuffix('.0') if isinstance(value, float) \
            else str(value)
    return SubElement(parent, tag, {name: text(value) for name, value in attributes.items()})


def _add_units(root: Element, variables: list[dict[str, Any]], fmi: int) -> None:
    used = {v['unit'] for v in variables if v['type'] == 'real' and v['unit']} | ({'s'} if fmi == 3 else set())
    units = _add(root, 'UnitDefinitions')
    for name in sorted(used):
        unit = _add(units, 'Unit', name=name)
        if name in BASE_UNITS:
            _add(unit, 'BaseUnit', **BASE_UNITS[name])


def _add_type(node: Element, variable: dict[str, Any], fmi: int) -> None:
    """The attributes of the type's own element (FMI 2) or of the variable's (FMI 3). FMI knows closed intervals only: the
    library checks open ends."""
    kind = variable['type']
    if kind == 'real' and variable['unit']:
        node.set('unit', variable['unit'])
    if kind in ('real', 'integer') and variable['least'] < variable['most']:
        for name, end in (('min', variable['least']), ('max', variable['most'])):
            node.set(name, str(int(end)) if kind == 'integer' else repr(end).removesuffix('.0'))
    if variable['causality'] == 'output':
        return
    if fmi == 3 and kind == 'string':
        _add(node, 'Start', value=variable['start'])
    else:
        node.set('start', variable['start'])


def _add_variables(root: Element, variables: list[dict[str, Any]], fmi: int) -> None:
    rows = _add(root, 'ModelVariables')
    if fmi == 3:
        _add(rows, 'Float64', name='time', valueReference=0, causality='independent', variability='continuous', unit='s')
    for reference, v in enumerate(variables, 1):
        tag = TYPES[v['type']][fmi - 2]
        allowed = [name for name in v['allowed'] if name != 'python']  # controllers that only this package has
        meaning = v['meaning'] + (': one of ' + ', '.join(allowed) if allowed else '')
        node = _add(rows, tag if fmi == 3 else 'ScalarVariable', name=v['name'], valueReference=reference, description=meaning,
                    causality=v['causality'],
                    variability='tunable' if v['tunable'] else 'fixed' if v['causality'] == 'parameter' else
                    'continuous' if v['type'] == 'real' else 'discrete')
        if fmi == 2 and v['causality'] == 'output':
            node.set('initial', 'calculated')
        _add_type(node if fmi == 3 else _add(node, tag), v, fmi)


def _add_structure(root: Element, variables: list[dict[str, Any]], fmi: int) -> None:
    """Outputs depend on states only; the structure names them once for each use."""
    structure = _add(root, 'ModelStructure')
    outputs = [reference for reference, v in enumerate(variables, 1) if v['causality'] == 'output']
    for use in ('Output', 'InitialUnknown'):
        rows = structure if fmi == 3 else _add(structure, use + 's')
        for reference in outputs:
            _add(rows, use, valueReference=reference) if fmi == 3 else _add(rows, 'Unknown', index=reference)


def description(model: dict[str, Any], fmi: int) -> bytes:
    """modelDescription.xml of the model, whose present parameters are the start values."""
    variables, step_s, state = model['variables'], model['step_s'], 'State' if fmi == 3 else 'state'
    root = Element('fmiModelDescription', {
        'fmiVersion': f'{fmi}.0', 'modelName': model['name'], 'instantiationToken' if fmi == 3 else 'guid': model['token'],
        'description': 'Inteco ABS laboratory rig, simulated' if model['varied_step'] else
                       'slip controller for the Inteco ABS laboratory rig',
        'author': 'The abs_hil authors', 'version': _core.version, 'license': 'BSD-3-Clause',
        'generationTool': f'abs_hil {_core.version}', 'variableNamingConvention': 'flat'})
    _add(root, 'CoSimulation', modelIdentifier=IDENTIFIER, canHandleVariableCommunicationStepSize=model['varied_step'],
         **{f'canGetAndSetFMU{state}': True, f'canSerializeFMU{state}': True},
         **({'fixedInternalStepSize': step_s} if fmi == 3 else {}))
    _add_units(root, variables, fmi)
    categories = _add(root, 'LogCategories')
    for name in ('logStatusError', 'logAll'):
        _add(categories, 'Category', name=name)
    _add(root, 'DefaultExperiment', startTime=0, stopTime=3, stepSize=step_s)
    _add_variables(root, variables, fmi)
    _add_structure(root, variables, fmi)
    ElementTree.indent(root)
    return bytes(ElementTree.tostring(root, 'UTF-8', xml_declaration=True))


def write(model: dict[str, Any], fmi: int, path: pathlib.Path) -> list[str]:
    """Writes the FMU, complete or not at all. Returns the platforms that it works on."""
    libraries = [(folder, library, names[fmi - 2]) for folder, ending, *names in PLATFORMS
                 if (library := FOLDER / folder / (IDENTIFIER + ending)).exists()]
    if not libraries:
        raise ValueError(f'"{FOLDER}" holds no library for FMUs; build the target abs_hil_fmu, or install abs_hil again')
    start = ''.join(f'{v["name"]}={v["start"]}\n' for v in model['variables'] if v['causality'] == 'parameter')

    def archive(name: str) -> None:
        with zipfile.ZipFile(name, 'w', zipfile.ZIP_DEFLATED) as fmu:
            fmu.writestr('modelDescription.xml', description(model, fmi))
            fmu.writestr('resources/start.txt', start)
            for _, library, folder in libraries:
                fmu.write(library, f'binaries/{folder}/{library.name}')
    write_whole(path, archive)
    return [folder for folder, _, _ in libraries]


@as_main(parsers.export_fmu)
def main(o: argparse.Namespace) -> None:
    if o.fmi not in (2, 3):
        raise ValueError(f'--fmi {o.fmi}: give 2 or 3')
    refuse_existing(o.out, '--out', o.force)
    given = {name: getattr(o, name) for name in ('config', 'plant', 'model', 'controller', 'set')}
    model = _core.fmu_model({name: value for name, value in given.items() if value is not None})
    platforms = write(model, o.fmi, o.out)
    print(f'{model["name"]}: FMI {o.fmi}.0 co-simulation, {len(model["variables"])} variables, step {model["step_s"]:g} s, for '
          f'{", ".join(platforms)}')
