//! Classes of surfaces: the label set of Cityscapes (Cordts et al. 2016), ids as in its published label table.

/// Declares the labels with id and name.
macro_rules! classes {
    ($($(#[$doc:meta])* $variant:ident = $id:literal, $name:literal;)+) => {
        /// Semantic class of a surface, numbered with the ids of Cityscapes.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default)]
        #[repr(u8)]
        pub enum SemanticClass {
            $($(#[$doc])* $variant = $id,)+
        }

        impl SemanticClass {
            /// All classes, by id.
            pub const ALL: &[Self] = &[$(Self::$variant),+];

            /// The class with an id of Cityscapes.
            pub fn from_id(id: u8) -> Option<Self> {
                match id {
                    $($id => Some(Self::$variant),)+
                    _ => None,
                }
            }

            /// Name in Cityscapes' table.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$variant => $name,)+
                }
            }
        }
    };
}

classes! {
    /// Nothing known.
    #[default]
    Unlabeled = 0, "unlabeled";
    /// Part of the vehicle that carries the camera.
    EgoVehicle = 1, "ego vehicle";
    /// Things that stand: bins, boxes, benches.
    Static = 4, "static";
    /// Things that move and are nothing else.
    Dynamic = 5, "dynamic";
    /// Ground that is none of the others.
    Ground = 6, "ground";
    /// Where cars drive, with its markings.
    Road = 7, "road";
    /// Where people walk, with its kerb.
    Sidewalk = 8, "sidewalk";
    /// Parking places.
    Parking = 9, "parking";
    /// Rail tracks.
    RailTrack = 10, "rail track";
    /// Houses.
    Building = 11, "building";
    /// Walls that stand alone.
    Wall = 12, "wall";
    /// Fences.
    Fence = 13, "fence";
    /// Guard rails.
    GuardRail = 14, "guard rail";
    /// Bridges.
    Bridge = 15, "bridge";
    /// Tunnels.
    Tunnel = 16, "tunnel";
    /// Poles, of signs and lights too.
    Pole = 17, "pole";
    /// Heads of traffic lights.
    TrafficLight = 19, "traffic light";
    /// Faces of traffic signs.
    TrafficSign = 20, "traffic sign";
    /// Trees, hedges.
    Vegetation = 21, "vegetation";
    /// Grass, soil, sand.
    Terrain = 22, "terrain";
    /// The open sky.
    Sky = 23, "sky";
    /// People on their feet.
    Person = 24, "person";
    /// People on two wheels.
    Rider = 25, "rider";
    /// Cars, vans.
    Car = 26, "car";
    /// Trucks.
    Truck = 27, "truck";
    /// Buses.
    Bus = 28, "bus";
    /// Caravans.
    Caravan = 29, "caravan";
    /// Trailers.
    Trailer = 30, "trailer";
    /// Trains, trams.
    Train = 31, "train";
    /// Motorcycles without their rider.
    Motorcycle = 32, "motorcycle";
    /// Bicycles without their rider.
    Bicycle = 33, "bicycle";
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ids_and_names_are_those_of_the_table() {
        for &class in SemanticClass::ALL {
            assert_eq!(SemanticClass::from_id(class as u8), Some(class));
        }
        assert_eq!(SemanticClass::from_id(99), None);
        assert_eq!(SemanticClass::Car as u8, 26);
        assert_eq!(SemanticClass::TrafficLight.name(), "traffic light");
    }
}
