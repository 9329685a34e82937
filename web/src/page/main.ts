document.body.textContent = "DeepLight";
