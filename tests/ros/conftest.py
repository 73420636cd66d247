"""Lets the tests of this folder import what they share, and the browser of the analysis' tests."""

import sys
from pathlib import Path

HERE = Path(__file__).parent
sys.path[:0] = [str(HERE), str(HERE.parent / "analysis")]
