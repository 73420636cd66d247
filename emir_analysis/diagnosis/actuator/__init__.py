"""The diagnosis of an actuator of which only valve opening and oil pressure are measured."""

from emir_analysis.diagnosis.actuator.command import command
from emir_analysis.diagnosis.actuator.result import ActuatorDiagnosis, summary

__all__ = ["ActuatorDiagnosis", "command", "summary"]
