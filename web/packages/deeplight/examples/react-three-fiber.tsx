import { Canvas } from "@react-three/fiber";
import type { Light } from "deeplight";
import { EstimatedLight } from "deeplight/react-three-fiber";
import { useEffect, useState } from "react";
import { createRoot } from "react-dom/client";
import { start } from "./show.ts";

function Ball() {
  const [light, setLight] = useState<Light | null>(null);
  useEffect(() => {
    start((fresh) => setLight(fresh));
  }, []);
  return (
    <Canvas flat camera={{ fov: 20, position: [0, 0, 10] }} gl={{ preserveDrawingBuffer: true }}>
      <EstimatedLight light={light} />
      <mesh>
        <sphereGeometry args={[1, 64, 32]} />
        <meshStandardMaterial metalness={1} roughness={0.2} />
      </mesh>
    </Canvas>
  );
}

createRoot(document.querySelector("#view")!).render(<Ball />);
