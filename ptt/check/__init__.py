"""Mistakes in the set-up, named before any physics."""

from ptt.check.check import check_setup
from ptt.check.result import MISTAKES, Check, Finding, setup_verdict

__all__ = ["MISTAKES", "Check", "Finding", "check_setup", "setup_verdict"]
