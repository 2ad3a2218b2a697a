//! Which nodes of the binary tree become nodes of the four-wide one: those that make the sum of inner areas least
//! (Pinto, "Adaptive collapsing on bounding volume hierarchies for ray-tracing", Eurographics 2010; in the form of Ylitie
//! et al. 2017, section 3.1). Leaves hold one triangle whatever is chosen, so they do not enter the cost.
//!
//! With c(n, j) the least cost of representing the subtree n by at most j wide nodes or leaves,
//! c(n, 1) = area(n) + open(n, 4) and c(n, j) = min(c(n, j − 1), open(n, j)), where open(n, j) = min over k of
//! c(left, k) + c(right, j − k). A leaf costs nothing.

use super::binary::Node;

/// What the least cost does with a node under each budget of wide children: how many of them the left child gets, or 0
/// to keep the node in one piece. Two bits a budget.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Choice(u8);

impl Choice {
    fn new(two: u8, three: u8, four: u8) -> Self {
        Self(two | three << 2 | four << 4)
    }

    /// Left child's share of `budget` ≥ 2; 0 means that the node takes one of the budget.
    fn left_share(self, budget: usize) -> usize {
        usize::from(self.0 >> (2 * (budget - 2)) & 3)
    }
}

/// c(n, 1), c(n, 2), c(n, 3).
type Costs = [f32; 3];

/// The choices for all nodes. Costs are needed only until the parent has read them: nodes stand in preorder, so from the
/// last to the first, the two children's costs are on top of a stack.
pub(super) fn choose(nodes: &[Node]) -> Vec<Choice> {
    let mut choices = vec![Choice::default(); nodes.len()];
    let Some(root) = nodes.first() else { return choices };
    let root_size = root.bounds().max - root.bounds().min;
    // Relative to the root, areas do not overflow; those that vanish cost nothing against it either.
    let relative = 1.0 / root_size.max_element().max(f32::MIN_POSITIVE);
    let mut stack: Vec<Costs> = Vec::new();
    for (node, choice) in nodes.iter().zip(&mut choices).rev() {
        if node.is_leaf() {
            stack.push([0.0; 3]);
            continue;
        }
        let left = stack.pop().expect("an inner node follows its children");
        let right = stack.pop().expect("an inner node follows its children");
        let costs;
        (costs, *choice) = choose_one(node.relative_half_area(relative), left, right);
        stack.push(costs);
    }
    choices
}

fn choose_one(area: f32, left: Costs, right: Costs) -> (Costs, Choice) {
    let open_four = [left[0] + right[2], left[1] + right[1], left[2] + right[0]];
    let four = (1..3).fold(0, |best, k| if open_four[k] < open_four[best] { k } else { best });
    let one = area + open_four[four];
    // What costs the same is opened: it saves a node.
    let open_two = left[0] + right[0];
    let (two, two_share) = if open_two <= one { (open_two, 1) } else { (one, 0) };
    let open_three = [left[0] + right[1], left[1] + right[0]];
    let three = usize::from(open_three[1] < open_three[0]);
    let (three, three_share) = if open_three[three] <= two { (open_three[three], three as u8 + 1) } else { (two, 0) };
    ([one, two, three], Choice::new(two_share, three_share, four as u8 + 1))
}

/// The wide children of a node that is to be a wide node: of a leaf, itself.
pub(super) fn wide_children(nodes: &[Node], choices: &[Choice], node: u32) -> ([u32; 4], usize) {
    let mut children = [0; 4];
    let mut count = 0;
    let mut take = |child: u32| {
        children[count] = child;
        count += 1;
    };
    // At most four: each entry holds at least one of the budget of four.
    let mut open = [(0u32, 0usize); 4];
    let mut opened = 0;
    match nodes.get(node as usize) {
        None => {}
        Some(root) if root.is_leaf() => take(node),
        Some(_) => {
            open[0] = (node, 4);
            opened = 1;
        }
    }
    while opened > 0 {
        opened -= 1;
        let (at, mut budget) = open[opened];
        let below = &nodes[at as usize];
        let choice = choices[at as usize];
        // Where a budget does not pay, c(n, j) is c(n, j − 1).
        while budget > 1 && choice.left_share(budget) == 0 {
            budget -= 1;
        }
        if below.is_leaf() || budget == 1 {
            take(at);
            continue;
        }
        let share = choice.left_share(budget);
        open[opened] = (at + below.right_or_primitive, budget - share);
        open[opened + 1] = (at + 1, share);
        opened += 2;
    }
    (children, count)
}
