"""Assessments: what a loop's routine data say, computed on demand or for the plant as a job."""
