"""The shipped families, begun early by a program that will need them: a halt is held against all of them."""

from drivebus._native import begin_families

__all__ = ["begin_families"]
