"""The whole machine: base, five joints with their linkages, five elastic arms, one pump.

Importing a module that needs Pinocchio without it raises ModuleNotFoundError; the main joint
alone (`emir_plant.plant`) does without.
"""
