"""What the service counts, in the format Prometheus reads."""

from prometheus_client import CollectorRegistry, Counter, Histogram, generate_latest


class Metrics:
    """Counters of one application; addresses are counted by their pattern, never by their ids.

    Attributes
    ----------
    requests : Counter
        Answered requests by method, route and status.
    seconds : Histogram
        Time to answer by method and route. [s]
    uploads, upload_bytes, upload_samples : Counter
        Stored exports, their size and the samples kept from them.
    """

    def __init__(self) -> None:
        self.registry = CollectorRegistry()
        self.requests = Counter(
            "loopwright_requests",
            "Answered requests.",
            ["method", "route", "status"],
            registry=self.registry,
        )
        self.seconds = Histogram(
            "loopwright_request_seconds",
            "Time to answer.",
            ["method", "route"],
            buckets=(0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60),
            registry=self.registry,
        )
        self.uploads = Counter("loopwright_uploads", "Stored exports.", registry=self.registry)
        self.upload_bytes = Counter(
            "loopwright_upload_bytes", "Size of stored exports.", registry=self.registry
        )
        self.upload_samples = Counter(
            "loopwright_upload_samples", "Samples kept from exports.", registry=self.registry
        )

    def text(self) -> bytes:
        """Write all numbers in the Prometheus text format."""
        return generate_latest(self.registry)
