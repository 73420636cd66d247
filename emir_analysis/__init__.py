"""From recordings to signals, metrics, pictures and what a model lacks; the `emir` command."""
