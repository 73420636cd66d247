"""The topics of the EMIR graph: one table, and conversions to and from standard messages."""
