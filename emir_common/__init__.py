"""What the machine and its control share: how a parameter is declared and checked."""
