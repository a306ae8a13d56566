"""What goes wrong by no fault of the code: one line that says what, where and the remedy."""

RESUMES = "what was finished is kept; the same command resumes from there"  # said of a command that was stopped


class UserError(Exception):
    """A mistake that the user can mend: one line that says what, where and the remedy."""


class DamagedFile(UserError):
    """A file that is there and cannot be read: one line that names it and says what is wrong."""
