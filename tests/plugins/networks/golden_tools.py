"""What every golden.py shares: reading a case, statistics of observations, searches, the step,
writing."""
import copy
import json
import math
import sys
from pathlib import Path
from types import SimpleNamespace

import torch
from torch.distributions import Normal


class GoldenAgent:
    """Settings, weights and moving averages of a case.

    Who inherits names its parameters in `groups`, an optimiser for each in `optimisers`,
    and returns (report, gradients) from update(update).
    """

    def __init__(self, data, known_settings):
        values = data["settings"]
        if set(values) != known_settings:
            raise SystemExit(f"settings that golden.py does not know: "
                             f"{sorted(set(values) - known_settings)}; that are missing: "
                             f"{sorted(known_settings - set(values))}")
        self.s = SimpleNamespace(**values)
        self.o, self.a = data["observation_size"], data["action_size"]
        self.weights = {n: torch.tensor(v, requires_grad=True) for n, v in data["weights"].items()}
        self.seen = []  # raw observations of all batches
        self.range = None  # moving average of the returns' 5 to 95 percent range

    def standardise(self, raw):
        """By mean and variance over all training batches, this one among them."""
        s = self.s
        self.seen.append(raw.reshape(-1, self.o))
        if not s.normalise_observations:
            return raw
        seen = torch.cat(self.seen)
        deviation = seen.var(0, unbiased=False).sqrt().clamp(min=s.observation_floor)
        return ((raw - seen.mean(0)) / deviation).clamp(-s.observation_clip, s.observation_clip)

    def follow_range(self, numbers):
        """Moves the range towards that of these numbers, or begins with it."""
        width = float(torch.quantile(numbers, 0.95) - torch.quantile(numbers, 0.05))
        old = width if self.range is None else self.range
        self.range = old + self.s.return_scale_rate * (width - old)

    def descend(self, losses, report):
        """One step of every group down its loss; returns the gradients before clipping."""
        gradients = {}
        for group, loss in losses.items():
            names = self.groups[group]
            found = torch.autograd.grad(loss, [self.weights[n] for n in names], retain_graph=True,
                                        allow_unused=True)
            found = [torch.zeros_like(self.weights[n]) if g is None else g
                     for n, g in zip(names, found)]
            gradients.update(zip(names, found))
            norm = float(torch.cat([g.flatten() for g in found]).norm())
            report["losses"][group + "_gradient_norm"] = norm
            report["covers"][group + " clipped"] = norm > self.s.gradient_clip
            for name, gradient in zip(names, found):
                self.weights[name].grad = gradient * min(1.0, self.s.gradient_clip / norm)
        report["gradient_norms"] = {n: g.norm() for n, g in gradients.items()}
        # All groups at once: every gradient above belongs to the same weights.
        for optimiser in self.optimisers.values():
            optimiser.step()
        return gradients


def remake(agent_of, slow):
    """golden.py FOLDER: makes NAME_output.json of every NAME_input.json there.

    agent_of(data) is a GoldenAgent; its attribute that `slow` names holds the weights
    which follow others slowly.
    """
    if len(sys.argv) != 2:
        raise SystemExit("usage: golden.py FOLDER")
    for path in sorted(Path(sys.argv[1]).glob("*_input.json")):
        data = json.loads(path.read_text())
        agent = agent_of(data)
        before = {n: w.detach().clone() for n, w in agent.weights.items()}
        slow_before = {n: w.clone() for n, w in getattr(agent, slow).items()}
        output = {"updates": []}
        for number, update in enumerate(data["updates"], 1):
            report, gradients = agent.update(update)
            print(path.name, "update", number, report.pop("covers"))
            output["updates"].append(report)
        output["gradients"] = gradients  # of the last update, before clipping
        output["step_norms"] = {n: (w - before[n]).norm() for n, w in agent.weights.items()}
        output[slow + "_step_norms"] = {n: (w - slow_before[n]).norm()
                                        for n, w in getattr(agent, slow).items()}
        target = path.with_name(path.name.replace("_input", "_output"))
        target.write_text(text(plain(output)) + "\n")


def plain(value):
    """Tensors as nested lists, numbers with 12 digits."""
    if isinstance(value, dict):
        return {k: plain(v) for k, v in value.items()}
    if isinstance(value, list):
        return [plain(v) for v in value]
    if isinstance(value, torch.Tensor):
        return plain(value.tolist())
    return float(f"{value:.11e}")


def text(value, indent=""):
    """JSON, objects over several lines and arrays of numbers on one."""
    inner = indent + " "
    if isinstance(value, dict):
        lines = [f"{inner}{json.dumps(k)}: {text(v, inner)}" for k, v in value.items()]
        return "{\n" + ",\n".join(lines) + f"\n{indent}}}"
    if isinstance(value, list) and isinstance(value[0], dict):
        return "[\n" + ",\n".join(inner + text(v, inner) for v in value) + f"\n{indent}]"
    return json.dumps(value, separators=(",", ":"))


class Searches:
    """What the searches of an update found, time first: [T, B, ...]."""

    def __init__(self, update, action_size):
        b, t = update["sequences"], update["length"]
        k = update.get("search_candidates", 0)

        def rows(name, *shape):
            values = update[name] if k > 0 else [0.0] * (b * t * math.prod(shape))
            return torch.as_tensor(values, dtype=torch.get_default_dtype()).reshape(
                b, t, *shape).transpose(0, 1)

        self.actions = rows("search_actions", max(k, 1), action_size)
        self.weights = rows("search_weights", max(k, 1))
        self.values = rows("search_values")

    @property
    def made(self):
        return (self.weights.sum(-1) > 0).double()

    def at(self, columns):
        """Those of some time-major columns, [K, ...]."""
        chosen = copy.copy(self)
        for name in ("actions", "weights", "values"):
            setattr(chosen, name, getattr(self, name).flatten(0, 1)[columns])
        return chosen

    def mix(self, share, values):
        return values + share * self.made * (self.values - values)

    def nll(self, policy):
        """Of the candidates before tanh under the Gaussian seen through noise of 0.1."""
        seen = Normal(policy.mean, (policy.stddev ** 2 + 0.01).sqrt())
        u = torch.atanh(self.actions.clamp(-0.999, 0.999))
        density = Normal(seen.mean.unsqueeze(-2), seen.stddev.unsqueeze(-2)).log_prob(u)
        return -(self.weights * density.mean(-1)).sum(-1)
