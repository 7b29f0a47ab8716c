//! Which faces of a mesh meet at which edges and vertices.

use glam::DVec3;
use std::collections::HashMap;

/// Faces, edges and vertices of a mesh as they hang together. Edges may have any number of faces; faces with a corner twice, or without
/// an area, are in none.
#[derive(Clone, Debug)]
pub struct Topology {
    /// Both ends of every edge, the lower first.
    edges: Vec<[u32; 2]>,
    /// Lengths of the edges.
    lengths_m: Vec<f64>,
    /// Edges of every face: opposite to its first, second and third corner; of a face that is none, [`NO_EDGE`].
    face_edges: Vec<[u32; 3]>,
    triangles: Vec<[u32; 3]>,
    edge_faces: Lists,
    vertex_faces: Lists,
    vertex_edges: Lists,
    /// Whether shortest ways may bend at a vertex: more than a full turn of faces, fewer around it than all, or edges of three faces.
    bends: Vec<bool>,
}

/// In place of an edge.
pub(super) const NO_EDGE: u32 = u32::MAX;

/// Of every item its list, one behind the other.
#[derive(Clone, Debug, Default)]
struct Lists {
    ends: Vec<u32>,
    items: Vec<u32>,
}

impl Lists {
    fn of(n_lists: usize, pairs: impl Iterator<Item = (u32, u32)> + Clone) -> Self {
        let mut ends = vec![0_u32; n_lists + 1];
        pairs.clone().for_each(|(list, _)| ends[list as usize + 1] += 1);
        for i in 0..n_lists {
            ends[i + 1] += ends[i];
        }
        let mut next = ends.clone();
        let mut items = vec![0; ends[n_lists] as usize];
        for (list, item) in pairs {
            let place = &mut next[list as usize];
            items[*place as usize] = item;
            *place += 1;
        }
        Self { ends, items }
    }

    fn get(&self, list: u32) -> &[u32] {
        &self.items[self.ends[list as usize] as usize..self.ends[list as usize + 1] as usize]
    }
}

/// Faces whose area is below this share of their longest edge squared have none.
const LEAST_AREA: f64 = 1e-12;

/// By no more than this beyond it a turn is a full one, radians.
const TURN_SLACK: f64 = 1e-9;

impl Topology {
    /// Of triangles between positions.
    ///
    /// **Cost** linear.
    #[must_use]
    pub fn of(positions_m: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let at = |vertex: u32| positions_m[vertex as usize];
        let is_face = |[a, b, c]: &[u32; 3]| {
            let (a, b, c) = (at(*a), at(*b), at(*c));
            let longest =
                (b - a).length_squared().max((c - a).length_squared()).max((c - b).length_squared());
            (b - a).cross(c - a).length() > LEAST_AREA * longest
        };
        let (mut edges, mut face_edges) = (Vec::new(), Vec::with_capacity(triangles.len()));
        let mut known: HashMap<[u32; 2], u32> = HashMap::with_capacity(2 * triangles.len());
        for triangle in triangles {
            if !is_face(triangle) {
                face_edges.push([NO_EDGE; 3]);
                continue;
            }
            face_edges.push([0, 1, 2].map(|corner| {
                let [from, to] = [triangle[(corner + 1) % 3], triangle[(corner + 2) % 3]];
                let ends = [from.min(to), from.max(to)];
                *known.entry(ends).or_insert_with(|| {
                    edges.push(ends);
                    edges.len() as u32 - 1
                })
            }));
        }
        let lengths_m = edges.iter().map(|[from, to]| at(*from).distance(at(*to))).collect();
        let faces = || (0_u32..).zip(&face_edges).filter(|(_, of)| of[0] != NO_EDGE);
        let edge_faces = Lists::of(edges.len(), faces().flat_map(|(face, of)| of.map(|edge| (edge, face))));
        let corners = faces().flat_map(|(face, _)| triangles[face as usize].map(|vertex| (vertex, face)));
        let vertex_faces = Lists::of(positions_m.len(), corners);
        let ends = (0_u32..).zip(&edges).flat_map(|(edge, ends)| ends.map(|vertex| (vertex, edge)));
        let vertex_edges = Lists::of(positions_m.len(), ends);
        let mut turns = vec![0.0; positions_m.len()];
        for (face, _) in faces() {
            let triangle = triangles[face as usize];
            for corner in 0..3 {
                let [own, next, last] = [0, 1, 2].map(|i| at(triangle[(corner + i) % 3]));
                turns[triangle[corner] as usize] += (next - own).angle_between(last - own);
            }
        }
        let mut bends: Vec<bool> =
            turns.iter().map(|turn| *turn > std::f64::consts::TAU + TURN_SLACK).collect();
        for (edge, ends) in (0..).zip(&edges) {
            if edge_faces.get(edge).len() != 2 {
                ends.iter().for_each(|vertex| bends[*vertex as usize] = true);
            }
        }
        Self {
            edges,
            lengths_m,
            face_edges,
            triangles: triangles.to_vec(),
            edge_faces,
            vertex_faces,
            vertex_edges,
            bends,
        }
    }

    /// Vertices, faces or not.
    #[must_use]
    pub fn n_vertices(&self) -> usize {
        self.bends.len()
    }

    /// Faces, with those that are none.
    #[must_use]
    pub fn n_faces(&self) -> usize {
        self.triangles.len()
    }

    /// How many edges there are.
    #[must_use]
    pub fn n_edges(&self) -> usize {
        self.edges.len()
    }

    /// Both ends of an edge.
    #[must_use]
    pub fn ends(&self, edge: u32) -> [u32; 2] {
        self.edges[edge as usize]
    }

    /// Its length, metres.
    #[must_use]
    pub fn length_m(&self, edge: u32) -> f64 {
        self.lengths_m[edge as usize]
    }

    /// Of all edges in the mean, metres; 0 without any.
    #[must_use]
    pub fn mean_length_m(&self) -> f64 {
        self.lengths_m.iter().sum::<f64>() / (self.lengths_m.len() as f64).max(1.0)
    }

    /// Faces at an edge.
    #[must_use]
    pub fn faces_at_edge(&self, edge: u32) -> &[u32] {
        self.edge_faces.get(edge)
    }

    /// Faces around a vertex, in no order.
    #[must_use]
    pub fn faces_at(&self, vertex: u32) -> &[u32] {
        self.vertex_faces.get(vertex)
    }

    /// Edges at a vertex, in no order.
    #[must_use]
    pub fn edges_at(&self, vertex: u32) -> &[u32] {
        self.vertex_edges.get(vertex)
    }

    /// The other end of an edge.
    #[must_use]
    pub fn across(&self, edge: u32, vertex: u32) -> u32 {
        let [from, to] = self.ends(edge);
        if from == vertex { to } else { from }
    }

    /// Whether a triangle is a face: it has an area.
    #[must_use]
    pub fn is_face(&self, face: u32) -> bool {
        self.face_edges[face as usize][0] != NO_EDGE
    }

    /// Corners of a face.
    #[must_use]
    pub fn corners(&self, face: u32) -> [u32; 3] {
        self.triangles[face as usize]
    }

    /// Edges of a face, each opposite to the corner of the same place.
    #[must_use]
    pub fn edges_of(&self, face: u32) -> [u32; 3] {
        self.face_edges[face as usize]
    }

    /// Whether shortest ways may bend at a vertex.
    #[must_use]
    pub fn may_bend(&self, vertex: u32) -> bool {
        self.bends[vertex as usize]
    }
}
