"""Machines of the blind test that are not EMIR: a valve, oil and a mass in normalised units."""
