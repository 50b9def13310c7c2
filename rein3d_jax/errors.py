"""The one exception that means "the input is at fault": its message names the file or key and the mend."""


class InputError(ValueError):
    """Bad input from a user. `experiments` prints the message as one line and exits with code 2."""
