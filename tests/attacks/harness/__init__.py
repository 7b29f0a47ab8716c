"""Harness of the attacks: a daemon with accounts, callers, a victim that is measured, and a report that judges.

Everything stays on loopback addresses, within a temporary folder, and ends with the script.
"""

from .callers import Answer, Caller, Crowd, ask
from .house import House, arguments
from .report import Report
from .victim import Victim

__all__ = ["Answer", "Caller", "Crowd", "House", "Report", "Victim", "arguments", "ask"]
