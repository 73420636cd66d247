"""What a user can get wrong."""


class InputError(ValueError):
    """A recording, file or setting cannot be used; the message is one line: what and where."""
