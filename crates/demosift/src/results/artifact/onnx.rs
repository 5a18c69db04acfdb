//! A policy as an ONNX model that needs nothing around it: raw observations go in, actions come out.
//!
//! The graph does what playing the mean action does, in the same order: filter (subtract, divide, clip), network, the
//! clipping that environments begin a step with, and the range of each actuator. The one difference is that ONNX's tanh is the exact function and
//! ours a rational one, at most 5e-7 from it.
//!
//! The operator set is the oldest in which all operators have the form that they have today, so that old runtimes,
//! those of robots among them, read the file.

use crate::basics::error::Result;
use crate::basics::ledger::Ledger;
use crate::data::observation_filter::CLIP;
use crate::results::protobuf::Message;
use crate::world::environment::Specification;
use crate::world::policy::Policy;

/// Version of the file's layout; the one that came with the operator set.
const IR_VERSION: u64 = 7;
const OPERATOR_SET: u64 = 14;
/// `FLOAT` in ONNX's enumeration of types.
const F32: u64 = 1;

/// Takes a policy's observations, `[batch, obs]`.
const OBSERVATION: &str = "observation";
/// Gives its mean actions, `[batch, act]`, each from −1 to 1.
const ACTION: &str = "action";
/// Gives the same as the actuators take them, `[batch, act]`.
const CONTROL: &str = "control";

/// Keeps the policy of a part beside its safetensors, unless it is there.
pub fn store_policy(
    ledger: &mut dyn Ledger,
    part: &str,
    policy: &Policy,
    task: &Specification,
) -> Result<()> {
    let (name, bytes) = (format!("policy_{part}.onnx"), write_policy(policy, task));
    if ledger.recall(&name)?.is_some_and(|held| held == bytes) {
        return Ok(());
    }
    ledger.store(&name, &bytes)
}

/// A policy for a task as ONNX: input `observation` `[batch, obs]` as the environment gives it; outputs `action`
/// `[batch, act]`, the mean action clipped to [−1, 1], and `control` `[batch, act]`, the same scaled to the range of
/// each actuator in its own unit.
///
/// # Panics
/// If the policy has other sizes than the task: a bug of the caller.
pub fn write_policy(policy: &Policy, task: &Specification) -> Vec<u8> {
    let sizes = (policy.filter().observation_size(), policy.action_size());
    assert_eq!(sizes, (task.observation_size, task.action_size), "sizes of the policy and of the task");
    let about = format!(
        "The mean action of a policy for the task {}, with the normalization of observations and the clipping of actions inside.",
        task.name
    );
    let parts: Vec<String> =
        task.observation_parts.iter().map(|(name, width)| format!("{name}: {width}")).collect();
    let metadata = [
        ("task", task.name.clone()),
        ("observation", parts.join(", ")),
        ("steps_per_sec", task.steps_per_sec().to_string()),
    ];
    Message::default()
        .integer(1, IR_VERSION)
        .text(2, "demosift")
        .text(3, env!("CARGO_PKG_VERSION"))
        .text(6, &about)
        .message(7, &graph(policy, task))
        .message(8, &Message::default().text(1, "").integer(2, OPERATOR_SET))
        .messages(14, metadata.map(|(key, value)| Message::default().text(1, key).text(2, &value)))
        .into_bytes()
}

fn graph(policy: &Policy, task: &Specification) -> Message {
    let mut graph = Graph::default();
    let filtered = filter(&mut graph, policy);
    let mean = network(&mut graph, policy, filtered);
    let (low, high) = (graph.scalar("lowest_action", -1.0), graph.scalar("highest_action", 1.0));
    graph.node("Clip", &[&mean, &low, &high], ACTION);
    scale(&mut graph, task);
    let (observations, actions) = (task.observation_size, task.action_size);
    let outputs = [
        value(ACTION, actions, "mean action, each number from -1 to 1"),
        value(CONTROL, actions, "the same in the range and the unit of each actuator"),
    ];
    Message::default()
        .messages(1, graph.nodes)
        .text(2, "policy")
        .messages(5, graph.constants)
        .message(11, &value(OBSERVATION, observations, "observation as the environment gives it"))
        .messages(12, outputs)
}

/// clip((o − mean) / std).
fn filter(graph: &mut Graph, policy: &Policy) -> String {
    let mean = graph.vector("observation_mean", policy.filter().mean());
    let std = graph.vector("observation_std", policy.filter().std());
    let (low, high) = (graph.scalar("lowest_filtered", -CLIP), graph.scalar("highest_filtered", CLIP));
    let centered = graph.node("Sub", &[OBSERVATION, &mean], "centered");
    let normalized = graph.node("Div", &[&centered, &std], "normalized");
    graph.node("Clip", &[&normalized, &low, &high], "filtered")
}

/// tanh between the layers, the last one linear.
fn network(graph: &mut Graph, policy: &Policy, filtered: String) -> String {
    let (layers, parameters) = (policy.network().layout(), policy.network_parameters());
    let last = layers.len() - 1;
    let mut values = filtered;
    for (index, layer) in layers.into_iter().enumerate() {
        let weight = &parameters[layer.weight];
        let weight = graph.constant(&format!("{index}.weight"), &[layer.inputs, layer.outputs], weight);
        let bias = graph.vector(&format!("{index}.bias"), &parameters[layer.bias]);
        let sums = if index == last { "mean".to_owned() } else { format!("{index}.sums") };
        values = graph.node("Gemm", &[&values, &weight, &bias], &sums);
        if index < last {
            values = graph.node("Tanh", &[&values], &format!("{index}.hidden"));
        }
    }
    values
}

/// middle + half the range · action, within the range: in 32 bits the ends of the sum may lie a little beyond it.
fn scale(graph: &mut Graph, task: &Specification) {
    let of_ranges = |number: fn([f64; 2]) -> f32| -> Vec<f32> {
        task.control_ranges.iter().map(|range| number(*range)).collect()
    };
    let half = graph.vector("control_half_range", &of_ranges(|[low, high]| (0.5 * (high - low)) as f32));
    let middle = graph.vector("control_middle", &of_ranges(|[low, high]| (0.5 * (high + low)) as f32));
    let low = graph.vector("lowest_control", &of_ranges(|[low, _]| least_within(low)));
    let high = graph.vector("highest_control", &of_ranges(|[_, high]| -least_within(-high)));
    let scaled = graph.node("Mul", &[ACTION, &half], "scaled");
    let moved = graph.node("Add", &[&scaled, &middle], "moved");
    // The operator Clip takes the same bounds for all numbers.
    let not_below = graph.node("Max", &[&moved, &low], "not_below");
    graph.node("Min", &[&not_below, &high], CONTROL);
}

/// The least number of 32 bits that is not below a bound.
fn least_within(low: f64) -> f32 {
    let nearest = low as f32;
    if f64::from(nearest) < low { nearest.next_up() } else { nearest }
}

/// What is computed, in order, and the constants of it.
#[derive(Default)]
struct Graph {
    nodes: Vec<Message>,
    constants: Vec<Message>,
}

impl Graph {
    /// Appends an operator and hands back the name of what it gives.
    fn node(&mut self, operator: &str, inputs: &[&str], output: &str) -> String {
        let node = inputs.iter().fold(Message::default(), |node, input| node.text(1, input));
        self.nodes.push(node.text(2, output).text(3, &format!("{operator} {output}")).text(4, operator));
        output.to_owned()
    }

    fn scalar(&mut self, name: &str, value: f32) -> String {
        self.constant(name, &[], &[value])
    }

    fn vector(&mut self, name: &str, values: &[f32]) -> String {
        self.constant(name, &[values.len()], values)
    }

    /// Adds a constant, row-major, and hands back its name.
    fn constant(&mut self, name: &str, shape: &[usize], values: &[f32]) -> String {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        let tensor = shape.iter().fold(Message::default(), |tensor, size| tensor.integer(1, *size as u64));
        self.constants.push(tensor.integer(2, F32).text(8, name).bytes(9, &bytes));
        name.to_owned()
    }
}

/// What goes into or comes out of the graph: `[batch, width]`.
fn value(name: &str, width: usize, about: &str) -> Message {
    let sizes = [Message::default().text(2, "batch"), Message::default().integer(1, width as u64)];
    let shape = Message::default().messages(1, sizes);
    let tensor = Message::default().integer(1, F32).message(2, &shape);
    Message::default().text(1, name).message(2, &Message::default().message(1, &tensor)).text(3, about)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_in_32_bits_lie_within_those_in_64() {
        for bound in [0.1, 0.7, -0.1, 1.0, 0.0, -2.5, 1e-300, 1e300, f64::INFINITY, f64::NEG_INFINITY] {
            let least = least_within(bound);
            assert!(f64::from(least) >= bound, "{least} is below {bound}");
            assert!(f64::from(least.next_down()) < bound || bound.is_infinite(), "{least} is not the least");
        }
        assert_eq!([-1.0, 0.4_f32.into()].map(least_within), [-1.0, 0.4]);
    }
}
