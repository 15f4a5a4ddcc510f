"""The same Gaussian process in scikit-learn and in GPyTorch: kernel (thesis 4.9), noise floor and start alike."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, Hyperparameter, Kernel, WhiteKernel

from gpsim.gp import Bounds, HyperParameters, TrainingData

try:
    import gpytorch
    import torch
except ImportError:
    gpytorch = None

FloatArray = NDArray[np.float64]
NOISE_FLOOR = Bounds().noise_std.low
HAS_GPYTORCH = gpytorch is not None


class ArdLinear(Kernel):  # type: ignore[misc]
    """sum_d stds_d^2 x_d x'_d, which scikit-learn does not have."""

    def __init__(self, stds: Any, stds_bounds: tuple[float, float] = (1e-4, 1e1)) -> None:
        self.stds, self.stds_bounds = stds, stds_bounds

    @property
    def hyperparameter_stds(self) -> Hyperparameter:
        return Hyperparameter("stds", "numeric", self.stds_bounds, len(self.stds))

    def __call__(self, X: FloatArray, Y: FloatArray | None = None, eval_gradient: bool = False) -> Any:
        square = np.asarray(self.stds) ** 2
        gram = (X * square) @ (X if Y is None else Y).T
        return (gram, 2.0 * square * X[:, None, :] * X[None, :, :]) if eval_gradient else gram

    def diag(self, X: FloatArray) -> FloatArray:
        return np.asarray(X**2 @ np.asarray(self.stds) ** 2)

    def is_stationary(self) -> bool:
        return False


def sklearn_kernel(hyper: HyperParameters) -> Kernel:
    rbf = ConstantKernel(hyper.signal_std**2, (1e-6, 1e4)) * RBF(hyper.lengthscales, (1e-2, 1e3))
    return rbf + ArdLinear(hyper.linear_stds) + ConstantKernel(hyper.bias_std**2, (1e-8, 1e2))


def sklearn_predictor(data: TrainingData, hyper: HyperParameters) -> GaussianProcessRegressor:
    regressor = GaussianProcessRegressor(sklearn_kernel(hyper), alpha=hyper.noise_std**2, optimizer=None)
    return regressor.fit(data.inputs, data.targets)


def sklearn_fit(data: TrainingData, start: HyperParameters) -> HyperParameters:
    kernel = sklearn_kernel(start) + WhiteKernel(start.noise_std**2, (NOISE_FLOOR**2, 1e2))
    found = GaussianProcessRegressor(kernel, alpha=0.0).fit(data.inputs, data.targets).kernel_
    rbf, linear, bias, white = found.k1.k1.k1, found.k1.k1.k2, found.k1.k2, found.k2
    variances = np.array([rbf.k1.constant_value, bias.constant_value, white.noise_level])
    signal, offset, noise = np.sqrt(variances)
    return HyperParameters(signal, rbf.k2.length_scale, np.asarray(linear.stds), offset, noise)


def torch_model(data: TrainingData, hyper: HyperParameters) -> Any:
    """GPyTorch's ExactGP with the same kernel, float64, at `hyper`."""
    kernels, dimension = gpytorch.kernels, data.inputs.shape[1]
    rbf = kernels.ScaleKernel(kernels.RBFKernel(ard_num_dims=dimension))
    linear, bias = kernels.LinearKernel(ard_num_dims=dimension), kernels.ConstantKernel()
    inputs, targets = torch.tensor(data.inputs), torch.tensor(data.targets)

    class Model(gpytorch.models.ExactGP):  # type: ignore[misc]
        def __init__(self) -> None:
            floor = gpytorch.constraints.GreaterThan(NOISE_FLOOR**2)
            super().__init__(inputs, targets, gpytorch.likelihoods.GaussianLikelihood(noise_constraint=floor))
            self.mean_module = gpytorch.means.ZeroMean()
            self.rbf, self.linear, self.bias = rbf, linear, bias
            # This order is GPyTorch's fastest: RBF first takes a low-rank update path, twice as slow.
            self.covar_module = linear + bias + rbf

        def forward(self, x: Any) -> Any:
            return gpytorch.distributions.MultivariateNormal(self.mean_module(x), self.covar_module(x))

    model = Model().double()
    rbf.outputscale, rbf.base_kernel.lengthscale = hyper.signal_std**2, torch.tensor(hyper.lengthscales)
    linear.variance = torch.tensor(hyper.linear_stds**2)[None, None]
    bias.constant = torch.tensor([hyper.bias_std**2], dtype=torch.float64)
    model.likelihood.noise = max(hyper.noise_std**2, NOISE_FLOOR**2 * (1.0 + 1e-9))
    return model


def torch_hyper(model: Any) -> HyperParameters:
    def array(value: Any) -> FloatArray:
        return np.asarray(value.detach().numpy(), dtype=np.float64).reshape(-1)

    single = [model.rbf.outputscale, model.bias.constant, model.likelihood.noise]
    signal, offset, noise = (float(np.sqrt(array(value)[0])) for value in single)
    stds = np.sqrt(array(model.linear.variance))
    return HyperParameters(signal, array(model.rbf.base_kernel.lengthscale), stds, offset, noise)


def torch_fit(data: TrainingData, start: HyperParameters, method: str) -> HyperParameters:
    """Adam (rate 0.1, as in GPyTorch's tutorials) until 30 steps gain less than 0.1; or torch's own L-BFGS.

    The best point visited counts: L-BFGS without bounds may end in NaN.
    """
    model = torch_model(data, start)
    model.train()
    objective = gpytorch.mlls.ExactMarginalLogLikelihood(model.likelihood, model)
    parameters, rows = list(model.parameters()), len(data.targets)
    best, found = np.inf, start

    def loss() -> Any:
        nonlocal best, found
        optimiser.zero_grad()
        value = -objective(model(*model.train_inputs), model.train_targets)
        value.backward()
        if float(value) < best:
            best, found = float(value), torch_hyper(model)
        return value

    if method == "L-BFGS":
        optimiser: Any = torch.optim.LBFGS(parameters, max_iter=200, line_search_fn="strong_wolfe")
        with contextlib.suppress(RuntimeError):
            optimiser.step(loss)
        return found
    optimiser, reached = torch.optim.Adam(parameters, lr=0.1), [np.inf]
    while len(reached) <= 1000 and not (len(reached) > 31 and rows * (reached[-31] - reached[-1]) < 0.1):
        reached.append(float(loss()))
        optimiser.step()
    return found


def torch_evaluation(data: TrainingData, hyper: HyperParameters) -> Callable[[], Any]:
    """Log likelihood and gradient by a factorisation, as it is exact, however many rows."""
    model = torch_model(data, hyper)
    model.train()
    objective = gpytorch.mlls.ExactMarginalLogLikelihood(model.likelihood, model)

    def evaluate() -> float:
        with gpytorch.settings.max_cholesky_size(len(data.targets) + 1):
            value = -objective(model(*model.train_inputs), model.train_targets)
            value.backward()
        return float(value)

    return evaluate


def torch_predictors(
    data: TrainingData, hyper: HyperParameters, new: FloatArray
) -> dict[str, Callable[[], Any]]:
    model, batch = torch_model(data, hyper), torch.tensor(new)
    model.eval()

    def mean() -> Any:
        with torch.no_grad(), gpytorch.settings.skip_posterior_variances():
            return model(batch).mean.numpy()

    def both() -> Any:
        with torch.no_grad(), gpytorch.settings.fast_pred_var():
            posterior = model(batch)
            return posterior.mean.numpy(), posterior.variance.numpy()

    return {"mean": mean, "mean and variance": both}
