"""Prints the numbers stored in src/nn/lstm_tests.rs: PyTorch's LSTM in double precision on parameters and inputs that are
sines, so that both sides can make them; the last hidden states and the gradient of the sum of cotangent times last hidden state.
Needs torch (2.15 was used). PyTorch has the gates in the same order, weights transposed, and two biases that are added."""
import torch

INPUTS, HIDDEN, STEPS, BATCH = 3, 4, 6, 2
torch.set_default_dtype(torch.float64)


def sines(count, step, scale):
    return scale * torch.sin(step * torch.arange(1, count + 1))


lstm = torch.nn.LSTM(INPUTS, HIDDEN)
columns = 4 * HIDDEN
count = (INPUTS + HIDDEN + 1) * columns
flat = sines(count, 0.7, 0.9).requires_grad_()
split = [INPUTS * columns, HIDDEN * columns, columns]
weight_x, weight_h, bias = torch.split(flat, split)
parameters = {
    "weight_ih_l0": weight_x.view(INPUTS, columns).T,
    "weight_hh_l0": weight_h.view(HIDDEN, columns).T,
    "bias_ih_l0": bias,
    "bias_hh_l0": torch.zeros(columns),
}
inputs = sines(STEPS * BATCH * INPUTS, 1.3, 1.5).view(STEPS, BATCH, INPUTS)
_, (hidden, _) = torch.func.functional_call(lstm, parameters, (inputs,))
cotangents = sines(BATCH * HIDDEN, 0.9, 1.0).view(1, BATCH, HIDDEN)
(hidden * cotangents).sum().backward()
show = lambda values: ", ".join(f"{value:.12f}" for value in values.flatten().tolist())
print("torch", torch.__version__)
print("hidden:", show(hidden.detach()))
print("every eleventh of the gradient:", show(flat.grad[::11]))
print("norm of the gradient:", f"{flat.grad.norm().item():.12f}")
