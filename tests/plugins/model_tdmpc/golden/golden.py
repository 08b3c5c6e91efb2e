#!/usr/bin/env python3
"""The update of TD-MPC2's networks with PyTorch, in double.

    golden.py FOLDER

reads FOLDER/NAME_input.json and writes FOLDER/NAME_output.json. The formulas are
those of the paper and of the settings' help, written with torch's own layers,
distributions, derivatives and optimiser; nothing is shared with the C++ model but
names, shapes and the order of the draws.

Sequences are [T, B]: time first.
"""
import sys
from pathlib import Path

import torch
from torch.distributions import Normal
from torch.distributions.transforms import TanhTransform
from torch.nn import functional as F

sys.path.append(str(Path(__file__).resolve().parents[2] / "networks"))
from golden_tools import GoldenAgent, Searches, remake  # noqa: E402

torch.set_default_dtype(torch.float64)
torch.set_num_threads(1)

SETTINGS = {
    "simplices", "encoder_width", "encoder_layers", "width", "layers", "critics", "bins",
    "bin_range", "normalise_observations", "observation_floor", "observation_clip", "rho",
    "consistency_weight", "reward_weight", "value_weight", "continuation_weight", "discount",
    "lambda", "target", "target_rate", "min_log_std", "max_log_std", "entropy_scale",
    "return_scale_rate", "search_policy_weight", "search_value_weight",
    "learning_rate", "encoder_rate_factor", "actor_learning_rate", "adam_epsilon",
    "actor_adam_epsilon", "gradient_clip",
}


def symlog(x):
    return x.sign() * torch.log(1 + x.abs())


def symexp(x):
    return x.sign() * (x.abs().exp() - 1)


class Networks:
    """The layers, over a dictionary of tensors by their exported names."""

    def __init__(self, settings, tensors):
        self.s = settings
        self.p = tensors
        self.bins = torch.linspace(-settings.bin_range, settings.bin_range, settings.bins)

    def affine(self, name, x):
        return F.linear(x, self.p[name + ".weight"], self.p[name + ".bias"])

    def normed(self, name, x):
        y = self.affine(name, x)
        return F.layer_norm(y, y.shape[-1:], self.p[name + ".norm_scale"],
                            self.p[name + ".norm_shift"])

    def hidden(self, name, layers, x):
        for i in range(layers):
            x = F.mish(self.normed(f"{name}.{i}", x))
        return x

    def latent(self, name, layers, x):
        x = self.normed(f"{name}.{layers}", self.hidden(name, layers, x))
        return F.softmax(x.unflatten(-1, (-1, 8)), -1).flatten(-2)

    def encode(self, o):
        return self.latent("encoder", self.s.encoder_layers, o)

    def step(self, z, a):
        return self.latent("dynamics", self.s.layers, torch.cat([z, a], -1))

    def head(self, name, x):
        return self.affine(name + ".out", self.hidden(name, self.s.layers, x))

    def reward(self, z, a):
        return self.head("reward", torch.cat([z, a], -1))

    def critic(self, k, z, a):
        return self.head(f"critic{k}", torch.cat([z, a], -1))

    def continuation_logit(self, z):
        return self.head("continuation", z).squeeze(-1) + 5

    def actor(self, z):
        m, c = self.head("actor", z).chunk(2, -1)
        s = self.s
        log_std = s.min_log_std + (s.max_log_std - s.min_log_std) * (torch.tanh(c) + 1) / 2
        return Normal(m, log_std.exp())

    def number(self, logits):
        return symexp((F.softmax(logits, -1) * self.bins).sum(-1))

    def cross_entropy(self, logits, target):
        """From the two-hot distribution of the target: linear between neighbouring bins."""
        y = symlog(target).clamp(-self.s.bin_range, self.s.bin_range)
        width = self.bins[1] - self.bins[0]
        two_hot = (1 - (y.unsqueeze(-1) - self.bins).abs() / width).clamp(min=0)
        return -(two_hot * F.log_softmax(logits, -1)).sum(-1)


class Agent(GoldenAgent):
    def __init__(self, data):
        super().__init__(data, SETTINGS)
        s = self.s
        self.target = {n: torch.tensor(v) for n, v in data["target"].items()}
        self.nets, self.slow = Networks(s, self.weights), Networks(s, self.target)
        actor = [n for n in self.weights if n.startswith("actor.")]
        encoder = [n for n in self.weights if n.startswith("encoder.")]
        others = [n for n in self.weights if n not in actor and n not in encoder]
        self.groups = {"model": encoder + others, "actor": actor}
        self.optimisers = {
            "model": torch.optim.Adam(
                [{"params": [self.weights[n] for n in encoder],
                  "lr": s.learning_rate * s.encoder_rate_factor},
                 {"params": [self.weights[n] for n in others]}],
                lr=s.learning_rate, eps=s.adam_epsilon),
            "actor": torch.optim.Adam([self.weights[n] for n in actor],
                                      lr=s.actor_learning_rate, eps=s.actor_adam_epsilon),
        }
        self.ends_seen = False

    def model_loss(self, update, report):
        s, nets = self.s, self.nets
        b, t = update["sequences"], update["length"]
        steps = t - 1

        def sequence(name, *shape):  # rows are sequence by sequence
            values = torch.as_tensor(update[name], dtype=torch.get_default_dtype())
            return values.reshape(b, t, *shape).transpose(0, 1)

        observations = self.standardise(sequence("observations", self.o))
        # What led to an observation belongs to the decision before it.
        actions, rewards = sequence("actions", self.a)[1:], sequence("rewards")[1:]
        discounts = sequence("discounts")
        self.ends_seen = self.ends_seen or bool((discounts == 0).any())
        # A step counts until the first that arrives in another episode.
        inside = (sequence("is_first")[1:] == 0).double().cumprod(0)
        encoded = nets.encode(observations)
        arrived = encoded[1:].detach()
        with torch.no_grad():
            noise = torch.as_tensor(update["target_noise"]).reshape(steps, b, self.a)
            policy = nets.actor(arrived)
            action = torch.tanh(policy.mean + policy.stddev * noise)
            least = torch.stack([nets.number(self.slow.critic(k, arrived, action))
                                 for k in update["target_critics"]]).amin(0)
            searches = Searches(update, self.a)
            least = torch.cat([torch.zeros(1, b), least])  # of every observation but the first
            value = searches.mix(s.search_value_weight, least)[1:]
            targets = rewards + s.discount * discounts[1:] * value
            for i in reversed(range(steps - 1)):
                share = getattr(s, "lambda") * inside[i + 1]
                targets[i] += s.discount * discounts[i + 1] * share * (targets[i + 1] - value[i])

        latents = [encoded[0]]
        for step in range(steps):
            latents.append(nets.step(latents[-1], actions[step]))
        latents = torch.stack(latents)
        before, after = latents[:-1], latents[1:]
        rho = s.rho ** torch.arange(steps).unsqueeze(-1)
        count = inside.sum()
        self.inside = torch.cat([torch.ones(1, b), inside])

        def mean(values):
            return (inside * values).sum() / count

        def over_time(losses):  # [H, B]
            return mean(rho * losses)

        consistency = over_time(((after - arrived) ** 2).mean(-1))
        reward = over_time(nets.cross_entropy(nets.reward(before, actions), rewards))
        value = sum(over_time(nets.cross_entropy(nets.critic(k, before, actions), targets))
                    for k in range(s.critics)) / s.critics
        continuation = torch.zeros(())
        if self.ends_seen:
            continuation = mean(F.binary_cross_entropy_with_logits(
                nets.continuation_logit(after), discounts[1:], reduction="none"))
        loss = (s.consistency_weight * consistency + s.reward_weight * reward +
                s.value_weight * value + s.continuation_weight * continuation)
        report["losses"] = dict(consistency_loss=consistency, reward_loss=reward,
                                value_loss=value, continuation_loss=continuation, model_loss=loss,
                                target_mean=mean(targets))
        report["scales"] = {"target_mean": mean(targets.abs())}
        report.update(latents=encoded.detach().reshape(t * b, -1), targets=targets.flatten())
        report["covers"] = {
            "observations clipped": int((observations.abs() == s.observation_clip).sum()),
            "targets beyond the bins": int((symlog(targets).abs() > s.bin_range).sum()),
            "episodes end": self.ends_seen,
            "steps inside": f"{int(count)} of {steps * b}",
        }
        return latents.detach(), loss

    def actor_loss(self, update, latents, report):
        s, nets = self.s, self.nets
        noise = torch.as_tensor(update["actor_noise"]).reshape(*latents.shape[:2], self.a)
        policy = nets.actor(latents)
        u = policy.mean + policy.stddev * noise
        action = torch.tanh(u)
        correction = TanhTransform().log_abs_det_jacobian(u, action)
        entropy = -(policy.log_prob(u) - correction).sum(-1)
        values = sum(nets.number(nets.critic(k, latents, action))
                     for k in range(s.critics)) / s.critics
        scale = 1.0 if self.range is None else max(1.0, self.range)
        rho = s.rho ** torch.arange(len(latents)).unsqueeze(-1)

        def mean(numbers):
            return (self.inside * numbers).sum() / self.inside.sum()

        searches = Searches(update, self.a)
        nll, searched = searches.nll(policy), mean(searches.made)
        gains = rho * (values / scale + s.entropy_scale * self.a * entropy -
                       s.search_policy_weight * nll)
        self.follow_range(values[0].detach())
        report["losses"].update(actor_loss=-mean(gains), value_mean=mean(values),
                                actor_entropy=mean(entropy),
                                actor_std=mean(policy.stddev.mean(-1)),
                                imitation_loss=mean(nll) / searched.clamp(min=1e-9),
                                searched=searched)
        # Means of terms of either sign may nearly cancel: the terms' mean size.
        report["scales"].update(actor_loss=mean(gains.abs()), value_mean=mean(values.abs()),
                                actor_entropy=mean(entropy.abs()))
        report["scales"]["imitation_loss"] = mean(nll.abs()) / searched.clamp(min=1e-9)
        report["return_range"] = self.range
        report["covers"]["states searched"] = int((self.inside * searches.made).sum())
        report["covers"]["return scale"] = scale
        return -mean(gains)

    def update(self, update):
        s = self.s
        report = {}
        latents, model = self.model_loss(update, report)
        actor = self.actor_loss(update, latents, report)
        gradients = self.descend({"model": model, "actor": actor}, report)
        for name, slow in self.target.items():
            slow += s.target_rate * (self.weights[name].detach() - slow)
        return report, gradients


if __name__ == "__main__":
    remake(Agent, "target")
