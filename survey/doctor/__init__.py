"""What is wrong with a survey, before any work: `flaneur doctor`."""

from survey.doctor.examination import Examination, examine
from survey.doctor.figures import COST_MEASURED_ON, Figures
from survey.doctor.findings import Finding, Severity

__all__ = ["COST_MEASURED_ON", "Examination", "Figures", "Finding", "Severity", "examine"]
