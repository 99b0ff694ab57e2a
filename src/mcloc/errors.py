"""What went wrong, where, and what would be right: every error that a user can cause."""


class McLocError(Exception):
    """The input was wrong. The message names the file or field and the remedy."""


class MapError(McLocError):
    """A map could not be read, or cannot be localized in."""


class LogError(McLocError):
    """A recorded log could not be read, or holds nothing to localize with."""


class TruthError(McLocError):
    """A reference trajectory could not be read, or does not overlap the estimates."""


class ConfigError(McLocError):
    """An unknown name, or a parameter that cannot be right."""


class FilterError(McLocError):
    """The filter was asked for something impossible: no particles, a NaN weight."""


class StateError(McLocError):
    """A saved state could not be read, or belongs to another map or run."""


class MessageError(McLocError):
    """A message of another robot cannot be right: the few words of it are what is counted."""
