//! Which members of a list of tuples of nodes contain a node.

/// The members that contain each node, in ascending order.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Incidence {
    /// Members of node i: `members[start[i]..start[i + 1]]`.
    members: Vec<usize>,
    start: Vec<usize>,
}

impl Incidence {
    /// The incidence of `nodes` nodes in `members`, which are tuples of nodes.
    pub(crate) fn new<M: IntoIterator<Item = usize>>(
        nodes: usize,
        members: impl Iterator<Item = M> + Clone,
    ) -> Self {
        let mut start = vec![0; nodes + 1];
        members.clone().flatten().for_each(|node| start[node + 1] += 1);
        for i in 0..nodes {
            start[i + 1] += start[i];
        }
        let mut next = start.clone();
        let mut all = vec![0; start[nodes]];
        for (index, member) in members.enumerate() {
            for node in member {
                all[next[node]] = index;
                next[node] += 1;
            }
        }
        Self { members: all, start }
    }

    /// Members that contain `node`; none for a node that is not in the list.
    pub(crate) fn of(&self, node: usize) -> &[usize] {
        match self.start.get(node..node + 2) {
            Some(&[from, to]) => &self.members[from..to],
            _ => &[],
        }
    }
}
