"""What does my model lack? From a recording and a data sheet to a named effect."""

from emir_analysis.diagnosis.command import command
from emir_analysis.diagnosis.result import Diagnosis, summary, write_json

__all__ = ["Diagnosis", "command", "summary", "write_json"]
