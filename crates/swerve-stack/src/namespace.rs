//! Names of the operators and streams of each ego's stack in the graph.

/// Names of one ego's stack in the graph: those of its assembly, with the name of the ego and a slash before them in
/// every stack but the first. The world has one operator, with a stream in the view of each ego.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Namespace {
    prefix: String,
    /// Stream of the world in the assembly, and in the graph; `None` in a world with one ego.
    world: Option<[String; 2]>,
}

impl Namespace {
    /// Names of the stack of `ego`, which is the first or not, in a world whose operator is `world`.
    pub fn new(ego: &str, is_first: bool, world: &str) -> Self {
        let prefix = if is_first { String::new() } else { format!("{ego}/") };
        Self { prefix, world: Some([world.to_owned(), format!("{world}.{ego}")]) }
    }

    /// Returns true for the stack of a world with one ego: its names are those of its assembly.
    pub fn is_alone(&self) -> bool {
        self.world.is_none()
    }

    /// Name of an operator in the graph.
    pub fn operator(&self, own: &str) -> String {
        match &self.world {
            Some([world, _]) if own == world => own.to_owned(),
            _ => format!("{}{own}", self.prefix),
        }
    }

    /// Name of a stream in the graph.
    pub fn stream(&self, own: &str) -> String {
        match &self.world {
            Some([world, view]) if own == world => view.clone(),
            _ => format!("{}{own}", self.prefix),
        }
    }

    /// Name in the assembly of an operator or stream of the graph; `None` for those of other egos.
    pub fn own<'a>(&'a self, name: &'a str) -> Option<&'a str> {
        match &self.world {
            Some([world, view]) if name == view || name == world => Some(world),
            Some([world, _]) if name.strip_prefix(world).is_some_and(|rest| rest.starts_with('.')) => None,
            _ => name.strip_prefix(&*self.prefix).filter(|own| !own.contains('/')),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_lead_to_the_graph_and_back() {
        let stacks = [
            Namespace::default(),
            Namespace::new("a", true, "simulator"),
            Namespace::new("b", false, "simulator"),
        ];
        for (names, operator, stream, world) in [
            (&stacks[0], "planner", "camera.image", "simulator"),
            (&stacks[1], "planner", "camera.image", "simulator.a"),
            (&stacks[2], "b/planner", "b/camera.image", "simulator.b"),
        ] {
            assert_eq!(names.operator("planner"), operator);
            assert_eq!(names.stream("camera.image"), stream);
            assert_eq!(
                (names.stream("simulator").as_str(), names.operator("simulator").as_str()),
                (world, "simulator")
            );
            assert_eq!(names.own(operator), Some("planner"));
            assert_eq!(names.own(stream), Some("camera.image"));
            assert_eq!((names.own(world), names.own("simulator")), (Some("simulator"), Some("simulator")));
            assert_eq!(names.own("c/planner"), None);
        }
        assert_eq!((stacks[1].own("b/planner"), stacks[2].own("planner")), (None, None));
        assert_eq!((stacks[1].own("simulator.b"), stacks[2].own("simulator.a")), (None, None));
    }
}
