"""Counts as Prometheus reads them."""

from facecode.serve.metrics import Metrics


def test_text():
    metrics = Metrics()
    metrics.sessions = 2
    metrics.ended["finished"] += 3
    for seconds in (0.005, 0.04, 0.04, 7.0):
        metrics.answered(seconds)
    lines = metrics.text().splitlines()
    assert "facecode_sessions 2" in lines
    assert 'facecode_connections_ended_total{reason="finished"} 3' in lines
    assert 'facecode_answer_seconds_bucket{le="0.01"} 1' in lines
    assert 'facecode_answer_seconds_bucket{le="0.05"} 3' in lines
    assert 'facecode_answer_seconds_bucket{le="1"} 3' in lines
    assert 'facecode_answer_seconds_bucket{le="+Inf"} 4' in lines
    assert "facecode_answer_seconds_count 4" in lines
    assert "facecode_answer_seconds_sum 7.085000" in lines
    typed = {line.split()[2] for line in lines if line.startswith("# TYPE")}
    named = {line.split()[0].partition("{")[0] for line in lines if not line.startswith("#")}
    assert {name.removesuffix(s) for name in named for s in ("_bucket", "_sum", "_count")} >= typed
