"""Plant files, sample store and resampling: the only place that knows exports."""
