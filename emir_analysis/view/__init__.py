"""`emir view`: a recording or the running graph as a page in the browser."""
