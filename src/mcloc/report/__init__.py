"""A run as a config describes it, and its outcome as files."""

from mcloc.report.files import check_folder, write_run
from mcloc.report.run import Run
from mcloc.report.summary import accuracy_of, summarize

__all__ = ["Run", "accuracy_of", "check_folder", "summarize", "write_run"]
