"""What does my model lack? From a recording and a data sheet to a named effect."""

from emir_analysis.diagnosis.command import command
from emir_analysis.diagnosis.result import Diagnosis, write_json
from emir_analysis.diagnosis.summary import summary

__all__ = ["Diagnosis", "command", "summary", "write_json"]
