"""The blind test: machines with a hidden effect, recorded and given to `diagnose` unlabelled.

What makes the machines is written a second time, by other means than `emir_plant`, and imports
neither that nor the diagnosis: what is judged has no share in the question.
"""
