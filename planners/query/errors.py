"""What can be wrong with a model."""

from __future__ import annotations

from anytime.errors import AnytimeError


class ModelError(AnytimeError):
    """A model asks for something that no form of it can have, or raised an error itself."""


class NativeError(ModelError):
    """A model uses what its native form cannot do; it may stay plain."""
