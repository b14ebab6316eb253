"""The network as a torch module."""

import numpy as np
import pytest
import torch

from nets import GaussianRbf, fit_rbf, measure_domain


def network(nodes=6, inputs=3, outputs=2, affine=True):
    rng = np.random.default_rng(7)
    slope = rng.normal(size=(inputs, outputs)) if affine else np.zeros((inputs, outputs))
    return GaussianRbf(
        scaling=(rng.normal(size=inputs), rng.uniform(10, 50, inputs)),
        centres=rng.normal(size=(nodes, inputs)),
        widths=rng.uniform(0.5, 2.0, nodes),
        weights=rng.normal(size=(nodes, outputs)),
        threshold=rng.normal(size=outputs),
        slope=slope,
        domain=measure_domain(rng.normal(size=(50, inputs))),
    )


@pytest.mark.parametrize(("inputs", "outputs"), [(1, 1), (3, 3), (5, 2)])
def test_forward_is_equations_14_and_17(inputs, outputs):
    net = network(inputs=inputs, outputs=outputs, affine=False)
    x = np.random.default_rng(1).normal(size=(20, inputs)) * 30
    mean, scale = net.input_mean.numpy(), net.input_scale.numpy()
    weights, threshold = net.weights.detach().numpy(), net.threshold.detach().numpy()
    expected = np.empty((20, outputs))
    for row in range(20):
        difference = (x[row] - mean) / scale - net.centres.numpy()
        phi = np.exp(-np.sum(difference**2, axis=1) / (2 * net.widths.numpy() ** 2))
        expected[row] = phi @ weights - threshold
    np.testing.assert_allclose(net.predict(x), expected, rtol=1e-11, atol=1e-12)
    assert (net.inputs, net.outputs) == (inputs, outputs)


def test_everything_is_float64():
    assert {each.dtype for each in network().state_dict().values()} == {torch.float64}


def test_batch_equals_loop_and_any_leading_shape():
    net, x = network(), torch.randn(4, 5, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0)) * 30
    looped = torch.stack([torch.stack([net(x[i, j]) for j in range(5)]) for i in range(4)])
    torch.testing.assert_close(net(x), looped, rtol=1e-12, atol=1e-13)
    np.testing.assert_allclose(
        net.predict(x.reshape(20, 3).numpy()), looped.detach().numpy().reshape(20, 2), rtol=1e-12
    )


def test_prediction_in_chunks_is_seamless(monkeypatch):
    net, x = network(), np.random.default_rng(0).normal(size=(101, 3)) * 20
    whole = net.predict(x)
    monkeypatch.setattr("nets.network.CHUNK_ROWS", 10)
    np.testing.assert_allclose(net.predict(x), whole, rtol=1e-12, atol=1e-13)
    assert net.predict(np.empty((0, 3))).shape == (0, 2)


def test_derivative_equals_the_numerical_one():
    net = network()
    x = torch.tensor([[3.0, -20.0, 11.0], [0.0, 4.0, -7.0]], dtype=torch.float64)
    for point in x:
        exact = torch.autograd.functional.jacobian(net, point)
        step = 1e-4 * torch.eye(3, dtype=torch.float64)
        numerical = torch.stack([(net(point + d) - net(point - d)) / 2e-4 for d in step], dim=-1)
        torch.testing.assert_close(exact, numerical, rtol=1e-7, atol=1e-9)
    assert torch.autograd.gradcheck(net, (x.clone().requires_grad_(),), eps=1e-4, atol=1e-6)


def test_derivative_exists_on_a_centre():
    net = network(affine=False)
    x = (net.centres[0] * net.input_scale + net.input_mean).requires_grad_()
    net(x).sum().backward()
    assert torch.isfinite(x.grad).all()


def test_far_away_only_the_threshold_is_left():
    net = network(affine=False)
    np.testing.assert_allclose(net.predict(np.full((1, 3), 1e5)), -net.threshold.detach().numpy()[None])


def test_weights_train_as_parameters():
    net = network()
    names = {name for name, each in net.named_parameters() if each.requires_grad}
    assert names == {"weights", "threshold", "slope"}
    net(torch.zeros(1, 3, dtype=torch.float64)).sum().backward()
    assert torch.isfinite(net.weights.grad).all()


def test_inside_uses_the_units_of_the_inputs():
    x = np.random.default_rng(0).uniform(-60, 60, size=(300, 3)) + np.array([0.0, 0.0, 500.0])
    net = fit_rbf(x, x[:, :1], centres=8, spread=2.0)
    assert net.inside(x).all()
    assert not net.inside([[0.0, 0.0, 0.0], [200.0, 0.0, 500.0]]).any()
