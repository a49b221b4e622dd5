"""Tests planned before they are run."""
