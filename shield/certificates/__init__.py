"""Certificates: functions of the fleet's state that are >= 0 while a boat can still keep clear."""

from .families import CERTIFICATES, Certificate

__all__ = ["CERTIFICATES", "Certificate"]
