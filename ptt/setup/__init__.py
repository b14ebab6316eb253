"""Mistakes in the set-up, named before any physics."""

from ptt.setup.check import check_setup
from ptt.setup.result import MISTAKES, Check, Finding, setup_verdict

__all__ = ["MISTAKES", "Check", "Finding", "check_setup", "setup_verdict"]
