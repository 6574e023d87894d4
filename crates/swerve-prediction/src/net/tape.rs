//! Tape of a computation for reverse-mode differentiation.

use core::ops::Range;

use super::{Gru, Layer, Matrix, forward};

/// A value on the tape.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) struct Node(usize);

/// Operation that produced a value.
enum Step {
    Given,
    Linear(Node, Layer),
    Relu(Node),
    Tanh(Node),
    Sigmoid(Node),
    /// Element-wise sum and product.
    Sum(Node, Node),
    Product(Node, Node),
    /// One minus the value.
    Rest(Node),
    /// Concatenation of columns.
    Beside(Vec<Node>),
    /// A range of columns, by its start.
    Columns(Node, usize),
    /// Selection of rows by index.
    Rows(Node, Vec<usize>),
    /// Maximum of each column over the rows of a group, with the index of its row; zero for an empty group.
    Largest(Node, Vec<Option<usize>>),
    /// Attention: queries, keys and values, with the weight of each row in its group.
    Attended {
        asked: Node,
        keys: Node,
        values: Node,
        groups: Vec<Range<usize>>,
        shares: Vec<f32>,
    },
}

/// A net's weights, and all values computed with them.
pub(crate) struct Tape<'a> {
    weights: &'a [Matrix],
    values: Vec<Matrix>,
    steps: Vec<Step>,
    /// True for inference without gradients.
    forward: bool,
}

impl<'a> Tape<'a> {
    /// Creates an empty tape.
    pub(crate) fn new(weights: &'a [Matrix]) -> Self {
        Self { weights, values: Vec::new(), steps: Vec::new(), forward: false }
    }

    /// Creates an empty tape for inference without gradients.
    pub(crate) fn forward(weights: &'a [Matrix]) -> Self {
        Self { forward: true, ..Self::new(weights) }
    }

    fn push(&mut self, value: Matrix, step: Step) -> Node {
        self.values.push(value);
        self.steps.push(step);
        Node(self.values.len() - 1)
    }

    /// Value of a node.
    pub(crate) fn value(&self, node: Node) -> &Matrix {
        &self.values[node.0]
    }

    /// Adds an input.
    pub(crate) fn given(&mut self, value: Matrix) -> Node {
        self.push(value, Step::Given)
    }

    /// Applies a linear layer.
    pub(crate) fn linear(&mut self, x: Node, layer: Layer) -> Node {
        let mut value = self.value(x).times(&self.weights[layer.0]);
        let bias = &self.weights[layer.0 + 1].values;
        for row in value.values.chunks_exact_mut(bias.len().max(1)) {
            row.iter_mut().zip(bias).for_each(|(sum, bias)| *sum += bias);
        }
        self.push(value, Step::Linear(x, layer))
    }

    /// Rectified linear unit: negative values become zero.
    pub(crate) fn relu(&mut self, x: Node) -> Node {
        self.push(self.value(x).map(|x| x.max(0.0)), Step::Relu(x))
    }

    /// Hyperbolic tangent.
    pub(crate) fn tanh(&mut self, x: Node) -> Node {
        self.push(self.value(x).map(libm::tanhf), Step::Tanh(x))
    }

    /// Logistic function.
    pub(crate) fn sigmoid(&mut self, x: Node) -> Node {
        self.push(self.value(x).map(|x| 1.0 / (1.0 + libm::expf(-x))), Step::Sigmoid(x))
    }

    /// Element-wise sum.
    pub(crate) fn sum(&mut self, a: Node, b: Node) -> Node {
        self.push(self.value(a).zip(self.value(b), |a, b| a + b), Step::Sum(a, b))
    }

    /// Element-wise product.
    pub(crate) fn product(&mut self, a: Node, b: Node) -> Node {
        self.push(self.value(a).zip(self.value(b), |a, b| a * b), Step::Product(a, b))
    }

    /// One minus the value.
    pub(crate) fn rest(&mut self, x: Node) -> Node {
        self.push(self.value(x).map(|x| 1.0 - x), Step::Rest(x))
    }

    /// Concatenates columns.
    pub(crate) fn beside(&mut self, parts: &[Node]) -> Node {
        let rows = self.value(parts[0]).rows;
        let columns = parts.iter().map(|part| self.value(*part).columns).sum();
        let mut values = Vec::with_capacity(rows * columns);
        for k in 0..rows {
            parts.iter().for_each(|part| values.extend_from_slice(self.value(*part).row(k)));
        }
        self.push(Matrix::new(rows, columns, values), Step::Beside(parts.to_vec()))
    }

    /// Selects a range of columns.
    pub(crate) fn columns(&mut self, x: Node, columns: Range<usize>) -> Node {
        let of = self.value(x);
        let rows = of.values.chunks_exact(of.columns);
        let values = rows.flat_map(|row| &row[columns.clone()]).copied().collect();
        self.push(Matrix::new(of.rows, columns.len(), values), Step::Columns(x, columns.start))
    }

    /// Selects rows by index; an index may be repeated.
    pub(crate) fn rows(&mut self, x: Node, rows: Vec<usize>) -> Node {
        let of = self.value(x);
        let values = rows.iter().flat_map(|k| of.row(*k)).copied().collect();
        self.push(Matrix::new(rows.len(), of.columns, values), Step::Rows(x, rows))
    }

    /// Maximum of each column over each group of rows; zero for an empty group.
    pub(crate) fn largest(&mut self, x: Node, groups: &[Range<usize>]) -> Node {
        let of = self.value(x);
        let mut from = Vec::with_capacity(groups.len() * of.columns);
        for group in groups {
            for j in 0..of.columns {
                let at = |k: usize| of.values[k * of.columns + j];
                from.push(group.clone().reduce(|best, k| if at(k) > at(best) { k } else { best }));
            }
        }
        let value = |(k, from): (usize, &Option<usize>)| {
            from.map_or(0.0, |row| of.values[row * of.columns + k % of.columns])
        };
        let values = from.iter().enumerate().map(value).collect();
        self.push(Matrix::new(groups.len(), of.columns, values), Step::Largest(x, from))
    }

    /// Attention: for each row of `asked`, the mean of its group's rows of `values`, weighted by the exponential of
    /// the scaled product with their `keys`; zero for an empty group.
    pub(crate) fn attended(
        &mut self,
        asked: Node,
        [keys, values]: [Node; 2],
        groups: Vec<Range<usize>>,
    ) -> Node {
        let (q, k, v) = (self.value(asked), self.value(keys), self.value(values));
        let scale = 1.0 / (q.columns as f32).sqrt();
        let mut shares = vec![0.0; v.rows];
        let mut value = Matrix::zeros(q.rows, v.columns);
        for (row, group) in groups.iter().enumerate() {
            let fit = |j: usize| scale * dot(q.row(row), k.row(j));
            let most = group.clone().map(fit).fold(f32::NEG_INFINITY, f32::max);
            let raw: Vec<f32> = group.clone().map(|j| libm::expf(fit(j) - most)).collect();
            let total: f32 = raw.iter().sum();
            for (j, raw) in group.clone().zip(raw) {
                shares[j] = raw / total;
                let to = value.row_mut(row);
                to.iter_mut().zip(v.row(j)).for_each(|(sum, value)| *sum += shares[j] * value);
            }
        }
        self.push(value, Step::Attended { asked, keys, values, groups, shares })
    }

    /// State of a recurrent unit after the input `x`.
    pub(crate) fn gru(&mut self, x: Node, memory: Node, unit: &Gru) -> Node {
        if self.forward {
            let layer = |layer: Layer| [&self.weights[layer.0], &self.weights[layer.0 + 1]];
            let of = [layer(unit.gates), layer(unit.new)];
            return self.push(forward::gru(self.value(x), self.value(memory), of), Step::Given);
        }
        let both = self.beside(&[x, memory]);
        let gates = self.linear(both, unit.gates);
        let gates = self.sigmoid(gates);
        let keep = self.columns(gates, 0..unit.size);
        let reset = self.columns(gates, unit.size..2 * unit.size);
        let old = self.product(reset, memory);
        let both = self.beside(&[x, old]);
        let new = self.linear(both, unit.new);
        let new = self.tanh(new);
        let take = self.rest(keep);
        let (kept, taken) = (self.product(keep, memory), self.product(take, new));
        self.sum(kept, taken)
    }

    /// Gradients of the weights, given those of some nodes.
    pub(crate) fn back(&self, from: Vec<(Node, Matrix)>) -> Vec<Matrix> {
        let mut weights: Vec<Matrix> =
            self.weights.iter().map(|one| Matrix::zeros(one.rows, one.columns)).collect();
        let mut turned: Vec<Option<Matrix>> = vec![None; self.weights.len()];
        let mut gradients = Gradients(self.values.iter().map(|_| None).collect());
        from.into_iter().for_each(|(node, gradient)| gradients.add(node, gradient));
        for k in (0..self.values.len()).rev() {
            let Some(gradient) = gradients.0[k].take() else { continue };
            if let Step::Linear(x, layer) = &self.steps[k] {
                weights[layer.0].add(&self.value(*x).transposed().times(&gradient));
                let bias = &mut weights[layer.0 + 1].values;
                for row in gradient.values.chunks_exact(gradient.columns) {
                    bias.iter_mut().zip(row).for_each(|(sum, one)| *sum += one);
                }
                if !matches!(self.steps[x.0], Step::Given) {
                    let turned = turned[layer.0].get_or_insert_with(|| self.weights[layer.0].transposed());
                    gradients.add(*x, gradient.times(turned));
                }
            } else {
                self.step_back(k, gradient, &mut gradients);
            }
        }
        weights
    }

    /// Backpropagates an operation without weights.
    fn step_back(&self, k: usize, gradient: Matrix, gradients: &mut Gradients) {
        let value = &self.values[k];
        match &self.steps[k] {
            Step::Given | Step::Linear(..) => {}
            Step::Relu(x) => gradients.add(*x, gradient.zip(value, |g, y| if y > 0.0 { g } else { 0.0 })),
            Step::Tanh(x) => gradients.add(*x, gradient.zip(value, |g, y| g * (1.0 - y * y))),
            Step::Sigmoid(x) => gradients.add(*x, gradient.zip(value, |g, y| g * y * (1.0 - y))),
            Step::Sum(a, b) => {
                gradients.add(*a, gradient.clone());
                gradients.add(*b, gradient);
            }
            Step::Product(a, b) => {
                gradients.add(*a, gradient.zip(self.value(*b), |g, b| g * b));
                gradients.add(*b, gradient.zip(self.value(*a), |g, a| g * a));
            }
            Step::Rest(x) => gradients.add(*x, gradient.map(|g| -g)),
            Step::Beside(parts) => {
                let mut from = 0;
                for part in parts {
                    let columns = self.value(*part).columns;
                    let rows = gradient.values.chunks_exact(gradient.columns);
                    let values = rows.flat_map(|row| &row[from..from + columns]).copied().collect();
                    gradients.add(*part, Matrix::new(gradient.rows, columns, values));
                    from += columns;
                }
            }
            Step::Columns(x, from) => {
                let mut whole = Matrix::zeros(gradient.rows, self.value(*x).columns);
                for row in 0..gradient.rows {
                    whole.row_mut(row)[*from..*from + gradient.columns].copy_from_slice(gradient.row(row));
                }
                gradients.add(*x, whole);
            }
            Step::Rows(x, rows) => {
                let mut whole = Matrix::zeros(self.value(*x).rows, gradient.columns);
                for (k, row) in rows.iter().enumerate() {
                    let to = whole.row_mut(*row);
                    to.iter_mut().zip(gradient.row(k)).for_each(|(sum, one)| *sum += one);
                }
                gradients.add(*x, whole);
            }
            Step::Largest(x, from) => {
                let mut whole = Matrix::zeros(self.value(*x).rows, gradient.columns);
                for (k, (from, one)) in from.iter().zip(&gradient.values).enumerate() {
                    if let Some(row) = from {
                        whole.values[row * gradient.columns + k % gradient.columns] += one;
                    }
                }
                gradients.add(*x, whole);
            }
            Step::Attended { asked, keys, values, groups, shares } => {
                let of = [*asked, *keys, *values];
                for (node, gradient) in of.into_iter().zip(self.attended_back(of, groups, shares, &gradient))
                {
                    gradients.add(node, gradient);
                }
            }
        }
    }

    /// Gradients of queries, keys and values.
    fn attended_back(
        &self,
        of: [Node; 3],
        groups: &[Range<usize>],
        shares: &[f32],
        gradient: &Matrix,
    ) -> [Matrix; 3] {
        let [q, k, v] = of.map(|node| self.value(node));
        let scale = 1.0 / (q.columns as f32).sqrt();
        let mut back = [q, k, v].map(|one| Matrix::zeros(one.rows, one.columns));
        for (row, group) in groups.iter().enumerate() {
            let g = gradient.row(row);
            let mean: f32 = group.clone().map(|j| shares[j] * dot(g, v.row(j))).sum();
            for j in group.clone() {
                let fit = scale * shares[j] * (dot(g, v.row(j)) - mean);
                let to = |to: &mut [f32], by: f32, row: &[f32]| {
                    to.iter_mut().zip(row).for_each(|(sum, one)| *sum += by * one);
                };
                to(back[0].row_mut(row), fit, k.row(j));
                to(back[1].row_mut(j), fit, q.row(row));
                to(back[2].row_mut(j), shares[j], g);
            }
        }
        back
    }
}

/// Accumulated gradients by node.
struct Gradients(Vec<Option<Matrix>>);

impl Gradients {
    fn add(&mut self, node: Node, gradient: Matrix) {
        match &mut self.0[node.0] {
            Some(sum) => sum.add(&gradient),
            none => *none = Some(gradient),
        }
    }
}

fn dot(a: &[f32], b: &[f32]) -> f32 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
