"""How good an estimator is: metrics, trivial baselines next to it, tables and figures."""
