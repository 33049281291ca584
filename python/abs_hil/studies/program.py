"""What abs_report does with the folder of a study."""
import argparse

from ..report.files import InputError
from .page import SHOWN, page, quantile_table
from .results import StudyResults, load_study

#: options of abs_report that are about the rows of runs
_OF_RUNS = ('labels', 'paper', 'figures', 'format', 'merits', 'columns')


def results_of(o: argparse.Namespace) -> StudyResults:
    """The one study of the command line. Raises InputError."""
    if len(o.runs) != 1:
        raise InputError('a study has a page of its own; give its folder alone')
    for name in _OF_RUNS:
        if getattr(o, name):
            raise InputError(f'--{name.removesuffix("s") if name == "labels" else name}: a study has no rows of single runs; '
                             'leave it out, or record a run with `abs_hil study FILE --run K`')
    if o.export not in (None, 'parquet'):
        raise InputError(f'--{o.export}: the results of a study are compressed CSV as they are; --parquet makes Parquet of them')
    try:
        return load_study(o.runs[0])
    except ValueError as error:
        raise InputError(str(error)) from None


def page_of(o: argparse.Namespace, results: StudyResults) -> str:
    metrics = [name for names in o.metrics for name in names.split(',')] or [name for name in SHOWN if name in results.metrics]
    for name in metrics:
        if name not in results.metrics:
            raise InputError(f'--metric {name}: the study has {", ".join(results.metrics)}')
    return page(results, metrics, o.title)


__all__ = ['page_of', 'quantile_table', 'results_of']
