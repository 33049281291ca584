"""abs_report: pages, figures, tables and exports of runs (docs/reports.md)."""
