"""How good an estimator is: metrics, trivial baselines beside it, tables and figures."""
