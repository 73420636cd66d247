"""`emir bench`: how fast the parts are, beside other programs doing the same in the same run."""
