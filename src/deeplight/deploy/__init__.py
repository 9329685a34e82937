"""A trained network made ready to run: ONNX, TFLite, fewer bits, its size and its speed."""
