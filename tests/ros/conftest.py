"""Lets the tests of this folder import the browser that those of the analysis have."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "analysis"))
